// UnfinishedStore: the folder `<output>.part` in which a tile store is made, and its way to the output's name. One run at a
// time has it; what a stopped run finished stays in it for one with the same plan.
// For the .cpp files of this folder only. Leaves what is written into it to store_writer.cpp.
#pragma once
#include <memory>
#include <string>

#include "tiles/plain_file.hpp"

namespace wedgescope {

inline constexpr const char *store_map_name = "blocks.map", *store_detail_name = "detail.map";
inline constexpr const char* store_plan_name =
    "plan.json";  ///< stays in the store: one killed while it finishes can go on

class UnfinishedStore {
public:
    /// Of the store that is to stand at `output`. Touches nothing.
    explicit UnfinishedStore(const std::string& output);

    const std::string& folder() const { return folder_; }
    std::string inside(const std::string& file) const;

    /// InputError where what stands at the output, or an earlier run left, may not be replaced; IoError.
    void check(bool overwrite, bool resume) const;
    /// Makes the folder, or empties what another run left there: not where `resume` is asked for and that had the same plan.
    /// InputError where it had another one; IoError, also where another run has it.
    void open(const std::string& plan, bool resume);
    /// Of that name, if it is missing, without what a killed run left half-written in it. IoError.
    void make_folder(const std::string& name);
    /// After an error or a stop. True if finished sheets stay, which is wished for; else nothing does.
    bool close(bool keep_sheets) noexcept;
    /// To the output's name, in place of a store that stands there, at once where the system can do that. InputError where by
    /// now something stands there that may not be replaced. IoError; the earlier store then stands there still, or the new one
    /// does and the message says what is left of the earlier.
    void move_into_place(bool overwrite);

private:
    void check_output(bool overwrite) const;
    void lock_plan();
    /// Where this one would be made lies what no run has begun.
    bool holds_else() const;
    [[noreturn]] void refuse_foreign() const;
    /// InputError where files lie in the folder that no store has.
    void refuse_foreign_files() const;
    void remove_all_but_plan() const;
    bool remove_folder() const noexcept;
    void replace_output();

    std::string output_, folder_;
    std::unique_ptr<PlainFile> plan_;  ///< locked while this run has the folder
};

}  // namespace wedgescope
